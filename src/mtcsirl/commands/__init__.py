"""The verbs of the command line, thin: arguments in, one call of the library out."""

"""Errors that a user can cause and mend."""


class UserError(Exception):
    """One line that names the file, key or value at fault and the way out; the CLI prints it and exits 2."""


class MissingError(UserError):
    """Something is not there that the workflow makes; whoever knows the command says how."""

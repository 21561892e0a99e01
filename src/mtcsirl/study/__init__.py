"""What a run is: the experimental design as data, its outputs, its cost, how far it is."""

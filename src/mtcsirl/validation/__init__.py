"""A small control family whose soft-optimal experts are known, and what MT-CSIRL recovers there."""

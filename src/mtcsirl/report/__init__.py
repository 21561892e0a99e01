"""The start page of the results: one self-contained HTML file."""

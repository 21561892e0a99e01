"""What turns docs/ into the site: links into the checkout, formulas and diagrams that need no script."""

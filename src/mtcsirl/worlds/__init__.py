"""Meta-World's tasks as environments: what an agent sees, fast and bit for bit."""

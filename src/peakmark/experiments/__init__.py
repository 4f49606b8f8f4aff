"""The paper's experiments: run(config) → result."""

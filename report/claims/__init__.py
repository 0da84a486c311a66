"""The paper's statements, each with our number and a verdict."""

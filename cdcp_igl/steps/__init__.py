"""The steps of Algorithm 1, a module for each."""

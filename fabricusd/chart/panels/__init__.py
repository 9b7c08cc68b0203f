"""The panels of the chart, each in a module of its own."""

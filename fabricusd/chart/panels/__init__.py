"""The panels of the chart, one file each."""

"""The published surface law: masked, reweighted threads at the levels far, weave and thread."""

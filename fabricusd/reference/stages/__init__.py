"""The stages that a batch of paths goes through, one compiled loop each."""

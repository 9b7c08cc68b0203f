"""What a path meets: cloth and preview surfaces."""

"""Weaves from pictures: drawdowns and artwork."""

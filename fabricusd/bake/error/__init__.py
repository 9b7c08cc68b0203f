"""How far a bake is from the truth, and which one meets a bound."""

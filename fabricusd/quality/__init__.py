"""How far apart two pictures or two reflectances are, and whether chance explains it."""

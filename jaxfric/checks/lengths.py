"""How many samples a test needs."""

# Samples in a span over which a force and what the velocity gains are compared.
SPAN = 16
# Pieces of fewer samples hold no kernel.
PIECE = 32
# The shortest kernel of the weak form reaches 16 samples each way: of a cycle that is no longer it
# averages most of the motion away.
CYCLE = 16

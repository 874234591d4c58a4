"""Training: the speed of the baselines, and of RecurrentPPO on ViZDoom beside them."""

OURS, THEIRS = "jaxenstein", "sb3"
TITLES = {OURS: "JAXenstein", THEIRS: "RecurrentPPO, ViZDoom"}

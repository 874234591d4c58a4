"""Which subjects are measured together, and how: in turn, on one core, undisturbed."""

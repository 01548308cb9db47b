"""A shadow technique and a scene from somebody else."""

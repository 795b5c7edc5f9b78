"""Pictures of mechanisms, runs and sweeps: `linkdyn.plot` names them."""

"""Results over a cycle, one file each: `linkdyn.cycle` names them."""

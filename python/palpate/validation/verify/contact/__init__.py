"""Contact: closed forms, direct solutions of the contact problem, and measurements in the force loop beside them."""

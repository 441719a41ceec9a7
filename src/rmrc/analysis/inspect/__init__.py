"""What an arm is at one configuration: its Jacobian, the directions it has lost, and what they cost."""

"""Define the tables of a scenario for the OSNMA broadcast and for the delays in the atmosphere."""

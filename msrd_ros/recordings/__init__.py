"""What judges and moves whole bags: inspection, acceptance, the folder of bags, bags as episodes."""

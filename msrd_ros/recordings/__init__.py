"""What judges and moves whole bags: inspection, storing, the folder of bags, bags as episodes."""

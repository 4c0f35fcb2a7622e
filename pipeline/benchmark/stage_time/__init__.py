"""What a serial costs in stage seconds: touch that chooses its passes against plans that are fixed or drawn."""

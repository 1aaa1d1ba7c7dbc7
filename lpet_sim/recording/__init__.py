"""What a recording holds, and how it is stored: the contract between simulation and estimators."""

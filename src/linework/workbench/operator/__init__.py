"""The page of the operator in the van: large keys for a touch screen, and how the drive goes."""

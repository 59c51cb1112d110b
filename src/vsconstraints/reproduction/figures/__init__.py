"""Our counterparts of the paper's figures. Only these modules import matplotlib."""

"""Code and files from outside the package: custom parts, optional packages, file provenance."""

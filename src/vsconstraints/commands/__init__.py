"""Commands of the command line that have a file each, and what all commands share."""

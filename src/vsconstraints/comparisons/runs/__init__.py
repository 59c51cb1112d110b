"""How runs are carried out: processes of their own, time limits, signals, and what an unfinished
command keeps.
"""

"""The methods that PNS is compared with: one `train.refining.Method` each.

Loop and PNS themselves live in `pns_common.schemes`.
"""

"""The methods that PNS is compared with: one scheme each, for `pns_common.refine`.

Loop and PNS themselves live in `pns_common.schemes`.
"""

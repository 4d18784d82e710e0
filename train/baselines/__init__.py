"""The methods that PNS is compared with: rules of the library's schemes."""

"""Maps on disk: zarr groups that xarray opens, written chunk by chunk."""

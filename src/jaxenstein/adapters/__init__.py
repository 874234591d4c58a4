"""Adapters to other libraries, one file per library.

Each file imports only what the extra of the same name installs. The adapters outside of JAX share
`batch`, except that of ViZDoom.
"""

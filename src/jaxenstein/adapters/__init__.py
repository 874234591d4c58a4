"""Adapters to other libraries, one file per library.

The rest of the package imports nothing from here. Each file imports only its own library, which
the extra of the same name installs. The adapters outside of JAX share `batch`.
"""

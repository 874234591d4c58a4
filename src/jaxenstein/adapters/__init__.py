"""JAXenstein in the words of other libraries, one file a partner.

Nothing here is imported by the rest of the package, and each file imports its partner alone; the
extra of the partner's name installs it. `batch` is what the loops outside of JAX share.
"""

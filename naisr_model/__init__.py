"""Neural additive shape atlases: a template, one displacement per covariate, and what they add up to.

The facade is :class:`naisr_model.atlas.Atlas`. Importing this package alone loads neither torch nor
any other heavy library.
"""

__version__ = "0.1.0"

"""The OpenGL renderer: face numbers from pyrender, integrated by the kernels of `peaksim.area`.

Nothing is imported here: OpenGL is loaded where it is used.
"""

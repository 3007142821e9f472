"""Render OpenUSD stages with NVIDIA Warp kernels, on the CPU and on CUDA with the same code."""

__version__ = "0.1.0"

"""What all of tolman shares."""

from common.compiled import keep_compiled_kernels

keep_compiled_kernels()

import os

from mtcsirl.files.processor import kernels

for _name, _value in kernels().items():  # before anything loads numpy, as every job does
    os.environ.setdefault(_name, _value)

#!/bin/sh
# An environment for imitation 1.0.1, which pins gymnasium 0.29 and stable-baselines3 2.2 and so cannot live beside this
# suite: build/imitation. torch, numpy and the rest come from the environment that runs this script.
#
#   sh benchmarks/imitation_environment.sh [PYTHON]      PYTHON: the suite's, default .venv/bin/python
set -eu
cd "$(dirname "$0")/.."
python=${1:-.venv/bin/python}
folder=build/imitation
[ -e "$folder/.ready" ] && exit 0
rm -rf "$folder"
"$python" -m venv --without-pip "$folder"
"$python" -m pip --python "$folder/bin/python" install --quiet --no-deps \
    imitation==1.0.1 stable-baselines3==2.2.1 gymnasium==0.29.1 tqdm==4.67.1
"$python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))' \
    > "$("$folder/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/suite.pth"
"$folder/bin/python" -c 'from imitation.algorithms.adversarial.airl import AIRL'
touch "$folder/.ready"

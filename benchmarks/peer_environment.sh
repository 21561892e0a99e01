#!/bin/sh
# An environment of its own for a peer that cannot live beside this suite, build/PEER: imitation 1.0.1 pins gymnasium
# 0.29 and stable-baselines3 2.2; sbx brings JAX. torch, numpy and the rest come from the environment that runs this.
#
#   sh benchmarks/peer_environment.sh PEER [PYTHON]      PEER: imitation or sbx; PYTHON: the suite's, .venv/bin/python
set -eu
cd "$(dirname "$0")/.."
peer=$1
python=${2:-.venv/bin/python}
case $peer in
imitation)
    packages="imitation==1.0.1 stable-baselines3==2.2.1 gymnasium==0.29.1 tqdm==4.67.1"
    tried="from imitation.algorithms.adversarial.airl import AIRL"
    ;;
sbx)
    # all that sbx needs beyond the suite; by name alone, torch would be there once more
    packages="sbx-rl==0.28.0 jax==0.10.2 jaxlib==0.10.2 flax==0.12.8 optax==0.2.8 ml_dtypes==0.6.0 opt_einsum==3.4.0
        tfp-nightly dm-tree gast decorator six msgpack orbax-checkpoint tensorstore treescope humanize simplejson
        aiofiles prometheus_client uvloop tqdm"
    tried="from sbx import SAC"
    ;;
*)
    echo "unknown peer $peer; known: imitation, sbx" >&2
    exit 2
    ;;
esac
folder=build/$peer
[ -e "$folder/.ready" ] && exit 0
rm -rf "$folder"
"$python" -m venv --without-pip "$folder"
# shellcheck disable=SC2086
"$python" -m pip --python "$folder/bin/python" install --quiet --no-deps $packages
"$python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))' \
    > "$("$folder/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/suite.pth"
"$folder/bin/python" -c "$tried"
touch "$folder/.ready"

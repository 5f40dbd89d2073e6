"""Writes batches of training crops to numbered files, and removes old ones, so that several trainings can read them.

python3 make_batches.py CROPS BATCHES --worker N --workers N [--negatives FOLDER] [--batch 16] [--keep 300]

Batch `n` is written by the worker n modulo the number of workers, at most KEEP ahead of the slowest reader; the
places of the readers stand in BATCHES/*.reader; a reader may read a batch again until it is removed.
"""

import argparse
import pickle
import time
from pathlib import Path

import torch

from crops import Crops, collate


def arguments():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("crops")
    parser.add_argument("batches", type=Path)
    parser.add_argument("--worker", type=int, required=True)
    parser.add_argument("--workers", type=int, required=True)
    parser.add_argument("--negatives")
    parser.add_argument("--batch", type=int, default=16)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=int, default=300)
    return parser.parse_args()


# Relief from bytes: two channels of -1 to 1, two of 0 to 1.
RELIEF_SCALE, RELIEF_ZERO = [127.0, 127.0, 255.0, 255.0], [127.0, 127.0, 0.0, 0.0]


def packed(crops):
    """Arrays of a batch, as small as possible: photos and relief in bytes, stones in 16 bits, boxes and numbers of
    stones filled up with zeros."""
    photos, relief, present, wanted = collate(crops)
    scale, zero = (torch.tensor(x)[:, None, None] for x in (RELIEF_SCALE, RELIEF_ZERO))
    most = max(1, *(len(t["boxes"]) for t in wanted))
    fill = lambda x: torch.nn.functional.pad(x, [0] * (2 * x.ndim - 1) + [most - len(x)])
    stack = lambda name: torch.stack([t[name] for t in wanted])
    arrays = {
        "photos": (photos * 255).round().to(torch.uint8),
        "relief": (relief * scale + zero).round().to(torch.uint8),
        "present": present,
        "boxes": torch.stack([fill(t["boxes"]) for t in wanted]),
        "numbers": torch.stack([fill(t["numbers"]) for t in wanted]).to(torch.int16),
        "stones": stack("stones").to(torch.int16),
        "unknown": stack("unknown"),
    }
    return {name: array.numpy() for name, array in arrays.items()}


def unpacked(arrays, device):
    """Photos, relief, present and targets of a batch on a device, as `learning.losses` takes them."""
    to = {name: torch.from_numpy(array).to(device, non_blocking=True) for name, array in arrays.items()}
    scale, zero = (torch.tensor(x, device=device)[:, None, None] for x in (RELIEF_SCALE, RELIEF_ZERO))
    targets = {
        "boxes": to["boxes"], "numbers": to["numbers"].long(),
        "stones": to["stones"].long(), "unknown": to["unknown"],
    }
    return to["photos"].float() / 255, (to["relief"].float() - zero) / scale, to["present"].float(), targets


def slowest(folder):
    places = [path.read_text() for path in folder.glob("*.reader")]
    return min((int(place) for place in places if place), default=0)


def main():
    args = arguments()
    torch.set_num_threads(1)
    args.batches.mkdir(parents=True, exist_ok=True)
    crops = iter(Crops(args.crops, args.negatives, [args.seed, args.worker]))
    number = args.worker
    while True:
        content = packed([next(crops) for _ in range(args.batch)])
        path = args.batches / f"{number:06}.batch"
        path.with_suffix(".part").write_bytes(pickle.dumps(content, protocol=5))
        path.with_suffix(".part").rename(path)
        (args.batches / f"{number - 2 * args.keep:06}.batch").unlink(missing_ok=True)
        number += args.workers
        while number > slowest(args.batches) + args.keep:
            time.sleep(0.05)


if __name__ == "__main__":
    main()

"""Trains the detector from batches that `make_batches.py` writes; continues from OUT/checkpoint.pt if it is there.

python3 train_detector.py BATCHES OUT --backbone efficientnet-lite0.pth --minutes N [--size 0] [--tune 0.1]

The backbone stays as it is; with --tune, its blocks from the first of stride 8 on are trained after the share
--tune-from of the time, at the share --tune of the learning rate. The learning rate falls to zero, as a cosine, over
the minutes. OUT/model.pt holds the running mean of the weights in half precision, OUT/loss.csv the step, the means of
the five losses over the last steps, seconds a step, and how many batches were read again.
"""

import argparse
import math
import pickle
import random
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import torch

from learning import losses
from make_batches import unpacked
from model import Detector

PRINT_STEPS = 50
# A training waits for this many batches before it reads one again.
LEAST_BATCHES = 100
# Weights of the running mean that is evaluated and shipped.
MEAN_DECAY = 0.998
# Largest norm of the gradient.
MOST_GRADIENT = 5.0


def arguments():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("batches", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--backbone", required=True)
    parser.add_argument("--size", type=int, default=0, help="0 to 2: EfficientNet-Lite0 to Lite2")
    parser.add_argument("--minutes", type=float, required=True, help="of this training, earlier runs counted in")
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--tune", type=float, default=0.0)
    parser.add_argument("--tune-from", type=float, default=0.1)
    parser.add_argument("--warmup", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    parser.add_argument("--save-minutes", type=float, default=1)
    parser.add_argument("--start", help="a model.pt to start from, with new moments of the optimizer")
    return parser.parse_args()


class Training:
    """The model, its optimizer, the running mean of its weights, and how far it has come."""

    def __init__(self, args):
        self.args, self.step, self.seconds = args, 0, 0.0
        self.model = Detector(args.size)
        self.model.backbone.body.load_package(args.backbone)
        self.model.backbone.body.requires_grad_(False)
        self.model.to(args.device, memory_format=torch.channels_last).train()
        blocks = self.model.backbone.body.blocks
        self.first_learnt = min(self.model.backbone.body.taps) + 1
        body = set(blocks[self.first_learnt :].parameters()) if args.tune else set()
        fixed = set(self.model.backbone.body.parameters()) - body
        names = {name: p for name, p in self.model.named_parameters() if p not in fixed}
        self.parameters, self.body = names, body
        groups = [
            {"params": [p for p in names.values() if p not in body], "share": 1.0},
            {"params": [p for p in names.values() if p in body], "share": args.tune},
        ]
        groups = [group for group in groups if group["params"]]
        self.optimizer = torch.optim.AdamW(groups, lr=args.rate, weight_decay=1e-2)
        state = {}
        if (args.out / "checkpoint.pt").exists():
            state = torch.load(args.out / "checkpoint.pt", map_location=args.device)
            self.model.load_state_dict(state["weights"], strict=False)
            self.optimizer.load_state_dict(state["optimizer"])
            self.step, self.seconds = state["step"], state["seconds"]
        elif args.start:
            state = torch.load(args.start, map_location=args.device)
            self.model.load_state_dict({k: v.float() for k, v in state["weights"].items()}, strict=False)
            state = {}
        self.mean = state.get("mean") or {name: p.detach().clone() for name, p in names.items()}

    def tune(self, is_tuned):
        """Trains the backbone's blocks from the first of stride 8 on, where that was asked for, or none of them."""
        body = self.model.backbone.body
        body.learnt_from = self.first_learnt if is_tuned and self.body else len(body.blocks)
        for p in self.body:
            p.requires_grad_(is_tuned)

    def choose_layout(self, images, relief, present):
        """Keeps images and weights in the memory layout that is faster on this device."""
        times, begun = {}, 0.0
        self.tune(True)
        for layout in (torch.channels_last, torch.contiguous_format):
            self.model.layout = layout
            self.model.to(memory_format=layout)
            for attempt in range(8):
                if attempt == 3:
                    torch.cuda.synchronize()
                    begun = time.time()
                sum(level.float().sum() for level in self.model.features(images, relief, present)).backward()
            torch.cuda.synchronize()
            times[layout] = (time.time() - begun) / 5
        best = min(times, key=times.get)
        self.model.layout = best
        self.model.to(memory_format=best)
        self.tune(False)
        self.optimizer.zero_grad(set_to_none=True)
        self.mean = {name: p.detach().clone() for name, p in self.parameters.items()}
        print(f"seconds for features: {times}; {best}", flush=True)

    def done(self):
        """Share of the time that is over."""
        return self.seconds / (60 * self.args.minutes)

    def learn(self, images, relief, present, targets):
        """One step; returns the losses as one tensor."""
        if self.done() >= self.args.tune_from:
            self.tune(True)
        rate = self.args.rate * min(1, (self.step + 1) / self.args.warmup)
        rate *= 0.5 + 0.5 * math.cos(math.pi * min(1, self.done()))
        for group in self.optimizer.param_groups:
            group["lr"] = rate * group["share"]
        parts = torch.stack(list(losses(self.model, images, relief, present, targets).values()))
        self.optimizer.zero_grad(set_to_none=True)
        parts.sum().backward()
        grads = [p.grad for p in self.parameters.values() if p.grad is not None]
        norm = torch.stack(torch._foreach_norm(grads)).norm()
        # A gradient that is not finite counts as zero.
        factor = torch.where(torch.isfinite(norm), (MOST_GRADIENT / (norm + 1e-6)).clamp(max=1), 0.0)
        for grad in grads:
            grad.nan_to_num_(0, 0, 0)
        torch._foreach_mul_(grads, factor)
        self.optimizer.step()
        self.step += 1
        decay = min(MEAN_DECAY, (1 + self.step) / (10 + self.step))
        with torch.no_grad():
            means, values = list(self.mean.values()), [self.parameters[name] for name in self.mean]
            torch._foreach_mul_(means, decay)
            torch._foreach_add_(means, values, alpha=1 - decay)
        return parts.detach()

    def save(self):
        """Writes the state to continue from and the mean weights to use, each complete or not at all."""
        state = {
            "step": self.step, "seconds": self.seconds, "mean": self.mean,
            "weights": {name: p.detach() for name, p in self.parameters.items()},
            "optimizer": self.optimizer.state_dict(),
        }
        half = {name: value.half().cpu() for name, value in self.mean.items()}
        for name, content in ("checkpoint.pt", state), ("model.pt", {"step": self.step, "size": self.args.size, "weights": half}):
            torch.save(content, self.args.out / f"{name}.part")
            (self.args.out / f"{name}.part").rename(self.args.out / name)


def batches(folder, reader, device):
    """Batches in their order; where the next is not there yet, one of those that are there, drawn at random. Each comes
    with the number of batches drawn so far."""
    place = folder / f"{reader}.reader"
    chance, repeated = random.Random(0), 0
    number = int(place.read_text()) if place.exists() else 0
    place.write_text(str(number))

    def next_one():
        nonlocal number, repeated
        while True:
            path = folder / f"{number:06}.batch"
            if path.exists():
                number += 1
                place.write_text(str(number))
            else:
                old = sorted(folder.glob("*.batch"))
                if len(old) < LEAST_BATCHES:
                    time.sleep(0.1)
                    continue
                path = chance.choice(old)
                repeated += 1
            try:
                return pickle.loads(path.read_bytes())
            except FileNotFoundError:
                number = max(number, min(int(p.stem) for p in folder.glob("*.batch")))

    with ThreadPoolExecutor(1) as reading:
        ahead = [reading.submit(next_one) for _ in range(2)]
        while True:
            arrays = ahead.pop(0).result()
            ahead.append(reading.submit(next_one))
            yield unpacked(arrays, device), repeated


def varied(images, relief, present, targets):
    """The batch with other colours and, in half of the cases, mirrored: batches are read more than once."""
    gain = torch.exp(0.1 * torch.randn(len(images), 3, 1, 1, device=images.device))
    images = (images * gain).clamp_(0, 1)
    if random.random() < 0.5:
        images, relief = images.flip(-1), relief.flip(-1)
        boxes, side = targets["boxes"], images.shape[-1]
        left, top, right, bottom = boxes.unbind(2)
        mirrored = torch.stack([side - right, top, side - left, bottom], 2)
        targets = {
            "boxes": torch.where((targets["numbers"] > 0)[..., None], mirrored, boxes), "numbers": targets["numbers"],
            "stones": targets["stones"].flip(-1), "unknown": targets["unknown"].flip(-1),
        }
    return images, relief, present, targets


def main():
    args = arguments()
    torch.set_num_threads(args.threads)
    torch.manual_seed(args.seed)
    random.seed(args.seed)
    torch.backends.cuda.matmul.allow_tf32 = torch.backends.cudnn.allow_tf32 = True
    args.out.mkdir(parents=True, exist_ok=True)
    training = Training(args)
    log = open(args.out / "loss.csv", "a", buffering=1)
    sums, since, saved = 0, time.time(), time.time()
    before = time.time()
    for batch, repeated in batches(args.batches, args.out.name, args.device):
        if training.step == 0 and args.device == "cuda":
            training.choose_layout(*batch[:3])
        sums = sums + training.learn(*varied(*batch))
        if training.step % PRINT_STEPS == 0:
            values = [f"{value:.4f}" for value in (sums / PRINT_STEPS).tolist()]
            print(training.step, *values, f"{(time.time() - since) / PRINT_STEPS:.3f}", repeated, sep=",", file=log)
            sums, since = 0, time.time()
        training.seconds += time.time() - before
        before = time.time()
        is_over = training.done() >= 1
        if is_over or time.time() - saved > 60 * args.save_minutes:
            training.save()
            saved = time.time()
        if is_over:
            break


if __name__ == "__main__":
    main()

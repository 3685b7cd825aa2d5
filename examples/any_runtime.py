"""Classify a prepared mesh with onnxruntime and NumPy alone; see docs/any-runtime.md.

python examples/any_runtime.py WHOLE.onnx MESH.off
"""

import json
import sys

import numpy as np
import onnxruntime

if len(sys.argv) != 3:
    sys.exit(__doc__)
model, mesh = sys.argv[1:]
words = open(mesh).read().split()
end = 4 + 3 * int(words[1])
vertices = np.array(words[4:end], np.float32).reshape(-1, 3)
faces = np.array(words[end:], np.int64).reshape(-1, 4)[:, 1:]

session = onnxruntime.InferenceSession(model)
scores, evidence, novelty, embedding = session.run(None, {"vertices": vertices, "faces": faces})

card = session.get_modelmeta().custom_metadata_map
classes = json.loads(card["meshconv3d.config"])["classes"]
for i in scores[0].argsort()[:-4:-1]:
    print(classes[i], scores[0, i])

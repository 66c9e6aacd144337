"""What the .proto files need for other languages than those that the tests speak."""

import glob
import importlib
import os
import sys
import unittest

sys.path.insert(0, os.environ["LITAGS_STUBS"])
PROTOS = glob.glob(os.path.join(os.path.dirname(os.environ["LITAGS_SERVICE_CONFIG"]), "*.proto"))


class Languages(unittest.TestCase):

    def test_every_file_names_its_go_package(self):
        self.assertGreaterEqual(len(PROTOS), 5)
        for path in PROTOS:
            name = os.path.basename(path).removesuffix(".proto")
            module = importlib.import_module(f"litags.v1.{name}_pb2")
            self.assertEqual(module.DESCRIPTOR.GetOptions().go_package, "litags/v1;litagsv1", path)


if __name__ == "__main__":
    unittest.main(verbosity=2)

"""Reads OSC bundles with python-osc, a library that is not ours.

    pip install python-osc
    python tests/osc_check.py DATAGRAMS.txt RESULT.json

DATAGRAMS.txt has a datagram a line, in hexadecimal digits. RESULT.json is a list of datagrams, each a list of messages:
[address, arguments ...].
"""

import json
import sys

from pythonosc.osc_bundle import OscBundle


def main(datagrams, result):
    with open(datagrams, encoding="ascii") as file:
        bundles = [OscBundle(bytes.fromhex(line)) for line in file.read().split()]
    read = [[[message.address, *message.params] for message in bundle] for bundle in bundles]
    with open(result, "w", encoding="utf-8") as file:
        json.dump(read, file)


if __name__ == "__main__":
    main(*sys.argv[1:])

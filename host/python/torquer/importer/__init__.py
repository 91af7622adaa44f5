"""From a CT angiography, or a label map of the vessels, to a case that runs (torquer-import).

    python3 -m torquer.importer CT_FOLDER --seed=-12,-30,1480 --out my_patient
"""

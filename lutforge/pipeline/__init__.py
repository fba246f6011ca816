"""The journey of the data as use cases, one file per step: each reads, does its work, and returns a record.

shots → samples → calibration → camera profile → transform → baked LUT → OpenColorIO config → graded images

All rules about options live here; the command line and the studio parse words, call these functions, and draw.

sampling: RAW files, tables and pairs of pictures → samples. response, charts: a bracket of a camera without RAW → a
profile. calibration: samples → profile; one camera's RAW → another's. evaluation: a profile's errors, and what it makes
of samples. reports: a page about a profile. transforms: profiles and settings → a transform. baking: a transform → LUT
files. configs: profiles → an OpenColorIO config. kits: a profile → a folder for one program. grading: images → graded
images. inspection: what a file holds. outputs: checks that several use cases share.
"""

"""Scripts that do by libraries alone what a command does, for `python -c`: what its speed is measured by."""

BARE_JPEG = """if True:
    import os, sys
    from concurrent.futures import ThreadPoolExecutor
    from pathlib import Path
    import PyOpenColorIO as OCIO, simplejpeg
    lut, out, *files = sys.argv[1:]
    Path(out).mkdir(exist_ok=True)
    code = OCIO.BIT_DEPTH_UINT8
    read = OCIO.Config.CreateRaw().getProcessor(OCIO.FileTransform(lut, "", OCIO.INTERP_TETRAHEDRAL))
    processor = read.getOptimizedCPUProcessor(code, code, OCIO.OPTIMIZATION_DEFAULT)
    def work(file):
        pixels = simplejpeg.decode_jpeg(Path(file).read_bytes())
        flat = pixels.reshape(-1, 3)
        for at in range(0, len(flat), 1 << 14):
            processor.applyRGB(flat[at : at + (1 << 14)])
        Path(out, Path(file).name).write_bytes(simplejpeg.encode_jpeg(pixels, 93, colorsubsampling="422"))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(work, files))
    """

BARE_FLOAT = """if True:
    import os, sys
    from concurrent.futures import ThreadPoolExecutor
    from pathlib import Path
    import OpenImageIO as oiio, PyOpenColorIO as OCIO
    lut, out, *files = sys.argv[1:]
    Path(out).mkdir(exist_ok=True)
    oiio.attribute("threads", 1)
    read = OCIO.Config.CreateRaw().getProcessor(OCIO.FileTransform(lut, "", OCIO.INTERP_TETRAHEDRAL))
    processor = read.getDefaultCPUProcessor()
    def work(file):
        source = oiio.ImageInput.open(file)
        spec, pixels = source.spec(), source.read_image(oiio.FLOAT)
        flat = pixels.reshape(-1, 3)
        for at in range(0, len(flat), 1 << 16):
            processor.applyRGB(flat[at : at + (1 << 16)])
        target = oiio.ImageOutput.create(file)
        target.open(str(Path(out, Path(file).name)), spec)
        target.write_image(pixels)
        target.close()
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(work, files))
    """


BARE_RAW = """if True:
    import os, sys
    from concurrent.futures import ThreadPoolExecutor
    import rawpy
    def work(file):
        with rawpy.imread(file) as raw:
            raw.postprocess(half_size=True, gamma=(1, 1), output_color=rawpy.ColorSpace.raw, user_wb=[1, 1, 1, 1],
                            no_auto_bright=True, adjust_maximum_thr=0, output_bps=16, user_flip=0)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(work, sys.argv[1:]))
    """

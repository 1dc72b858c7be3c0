// Before the scene's own code: a browser without a graphics processor draws it on the processor, pixel by pixel.
// There edges are not smoothed, no picture is copied to be kept, and nothing shines through what is drawn.

function drawsOnProcessor() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const facts = gl?.getExtension("WEBGL_debug_renderer_info");
  const renderer = facts ? gl.getParameter(facts.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(renderer);
}

if (drawsOnProcessor()) {
  const getContext = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, wanted) {
    if (!/^webgl/.test(kind)) return getContext.call(this, kind, wanted);
    const gl = getContext.call(this, kind, { ...wanted, antialias: false, preserveDrawingBuffer: false, alpha: false });
    if (gl === null) return gl;
    const clearColor = gl.clearColor;
    gl.clearColor = (...colour) => clearColor.apply(gl, colour[3] === 0 ? [1, 1, 1, 1] : colour);
    gl.clearColor(0, 0, 0, 0);
    return gl;
  };
}

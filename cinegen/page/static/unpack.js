// Unpack the page: the viewer, the modules and what the session begins with are compressed in the element "packed".
(async (nonce) => {
  const bytes = Uint8Array.from(atob(document.getElementById("packed").textContent), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const { viewer, modules, content } = await new Response(stream).json();
  const add = (type, text) => {
    const script = document.createElement("script");
    Object.assign(script, { nonce, type, textContent: text });
    document.body.append(script);
    return script;
  };
  add("text/javascript", viewer);
  add("application/json", JSON.stringify(content)).id = "cinegen-page";
  add("importmap", JSON.stringify({ imports: modules }));
  add("module", 'import "cinegen/start.js";');
})(document.currentScript.nonce);

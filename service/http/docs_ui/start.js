// The description is next to this page, whatever prefix a proxy puts in front of both; no validator
// of another host is asked.
SwaggerUIBundle({
  url: "openapi.json",
  dom_id: "#ui",
  deepLinking: true,
  validatorUrl: null,
  docExpansion: "list",
});

// The page /docs: what this very service answers at /openapi.json, and nothing from elsewhere.

SwaggerUIBundle({
  url: "/openapi.json",
  dom_id: "#interface",
  deepLinking: true,
  defaultModelExpandDepth: 4,
  // Else a service of the network would be asked whether the description is valid.
  validatorUrl: null,
});

// As dark as the rest of the reader's screen.
const dark = matchMedia("(prefers-color-scheme: dark)");
const look = () => document.documentElement.classList.toggle("dark-mode", dark.matches);
dark.addEventListener("change", look);
look();

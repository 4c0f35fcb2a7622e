"use strict";
{
  const place = document.getElementById("interface");
  SwaggerUIBundle({ domNode: place, url: place.dataset.description, validatorUrl: null, deepLinking: true });
}

"""The model: elements, assemblies, addresses of parameters, natural and complex modes."""

"""The reference path tracer: scene, acceleration structure, lights, cameras, film."""

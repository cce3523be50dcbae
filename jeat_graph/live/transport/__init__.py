"""Scans from a message broker and tracks to one: MQTT, NATS and Kafka, at least once, in order."""
